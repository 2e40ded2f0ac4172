"""The paper's controller: PD, feed-forward of the planned acceleration, a disturbance observer (DOB) in each joint.

    tau = M_n J^-1 (a - J' qd) + tau_dis,    a = a_cmd + K_p (x_cmd - x) + K_v (v_cmd - v)
    tau_dis = g / (s + g) (tau + g M_n qd) - g M_n qd

Gains and margins are the paper's; nothing here is tuned.  pd_ff_dob_tuned.py says what tuning brings.
"""

NAME = "PD + FF + DOB"
AUTHOR = "flipdiagram"
REFERENCE = "the paper: Acceleration Control for Dynamic Manipulation of a Robot Turning Over Objects, section II-C"
ARCHITECTURE = "pd+ff+dob"
