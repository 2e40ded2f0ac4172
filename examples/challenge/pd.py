"""The paper's PD: acceleration control without feed-forward and without observer.

    tau = M_n J^-1 (a - J' qd),    a = K_p (x_cmd - x) + K_v (v_cmd - v)

M_n is constant and diagonal.  Gravity, friction and the acceleration of the motion itself are all left to the error:
the arm sags and lags.  Gains and margins are the paper's; nothing here is tuned.
"""

NAME = "PD"
AUTHOR = "flipdiagram"
REFERENCE = "the paper: Acceleration Control for Dynamic Manipulation of a Robot Turning Over Objects, section II-C"
ARCHITECTURE = "pd"
