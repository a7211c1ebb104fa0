"""The information of logs on one truck, kept so that later logs begin with it.

identification of a log -> its information (information.py)
                        -> with that of other logs: estimates over days, changes (combination.py, states.py, changes.py)
                        -> prior of the next identification (knowledge.py), a file (storage.py)
"""
