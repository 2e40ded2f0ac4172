"""Many flips, each in a process of its own: a study's (`run`) and a campaign's (`campaign.run`) go the same way.

`driver` hands them out to `workers`; `child_process` is where `flight` is flown; `store` in
`store_file` keeps each as it ends.
"""
