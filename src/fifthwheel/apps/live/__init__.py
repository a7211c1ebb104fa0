"""The live node: frames of a bus to states and parameters, on-line or from a trace.

node        Node: takes a frame, gives outputs; without clock, thread or socket
time_base   the node's time from the timestamps of all buses
sampler     samples at 100 Hz from readings that arrive in any order
status      the numbers of status and faults, faults of the signals
learning    parameters for each trailer, and changes of load or trailer; checkpoint: their file
coach       what to drive next
sources     live buses and traces
outputs     frames with their DBC, and files
session     what happens with an output
page        the web page
summary     the result at the end of a run
setup       a run from what a user requests
"""
