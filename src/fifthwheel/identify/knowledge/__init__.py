"""What logs of one truck told of it, kept so that later logs begin from it.

identification of a log -> its information (information.py)
                        -> with that of other logs: estimates over days, changes (combination.py, states.py, changes.py)
                        -> prior of the next identification (knowledge.py), a file (storage.py)
"""
