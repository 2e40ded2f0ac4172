"""The paper's PD with a disturbance observer (DOB) in each joint, without feed-forward.

    tau = M_n J^-1 (a - J' qd) + tau_dis,    a = K_p (x_cmd - x) + K_v (v_cmd - v)
    tau_dis = g / (s + g) (tau + g M_n qd) - g M_n qd

The observer holds the arm's weight and whatever else a diagonal M_n does not explain, up to g = 12.6 rad/s.  Gains and
margins are the paper's; nothing here is tuned.
"""

NAME = "PD + DOB"
AUTHOR = "flipdiagram"
REFERENCE = "the paper: Acceleration Control for Dynamic Manipulation of a Robot Turning Over Objects, section II-C"
ARCHITECTURE = "pd+dob"
