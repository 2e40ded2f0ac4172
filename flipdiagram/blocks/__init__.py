"""The boxes of Fig. 4 of the paper: one box, one Drake system, one file.

Each system is a thin shell around a pure function of arrays, converts between float, AutoDiffXd and
Expression where its maths allows, keeps its gains as numeric parameters and its state in the Context, and
names its ports after the signals of the figure. A converted system has the gains its original was built
with; gains changed in a Context are carried over with ``SetTimeStateAndParametersFrom``.
"""
