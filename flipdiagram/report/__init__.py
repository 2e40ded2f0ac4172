"""The reproduction report: runs or reuses the studies, and writes every claim, measured, on one page."""

from flipdiagram.report.report import Report, write_report

__all__ = ["Report", "write_report"]
