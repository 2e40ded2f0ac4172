"""The reproduction report: runs or reuses the studies, and writes every claim, measured, on one page."""
