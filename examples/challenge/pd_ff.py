"""The paper's PD with the planned acceleration fed forward.

    tau = M_n J^-1 (a - J' qd),    a = a_cmd + K_p (x_cmd - x) + K_v (v_cmd - v)

The acceleration no longer comes from an error first, but the weight of the arm still does: it sags.  Gains and margins
are the paper's; nothing here is tuned.
"""

NAME = "PD + FF"
AUTHOR = "flipdiagram"
REFERENCE = "the paper: Acceleration Control for Dynamic Manipulation of a Robot Turning Over Objects, section II-C"
ARCHITECTURE = "pd+ff"
