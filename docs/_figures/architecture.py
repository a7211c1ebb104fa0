"""Draws docs/_static/architecture.svg: the data flow between the packages."""

from svg import box, label, path, picture

BOXES = {  # name: (x, y, what it holds)
    "logs": (20, 30, "files to records"),
    "checks, time_bases": (210, 30, "faults of signals"),
    "vehicle": (20, 130, "parameters, sigmas"),
    "dynamics": (210, 130, "equations of motion"),
    "filters, native": (400, 130, "Kalman steps, compiled"),
    "identify": (590, 80, "parameters, verdicts"),
    "observe": (590, 180, "states"),
    "diagnose": (780, 80, "findings, advice"),
    "report, pages": (780, 180, "tables, plots, words"),
    "manoeuvres": (20, 230, "what is driven"),
    "simulate": (210, 230, "linear, with noise"),
    "plant": (400, 230, "nonlinear truck"),
}
FLOWS = [
    [(170, 55), (210, 55)],
    [(360, 55), (665, 55), (665, 80)],
    [(170, 155), (210, 155)],
    [(360, 155), (400, 155)],
    [(550, 155), (570, 155), (570, 105), (590, 105)],
    [(570, 155), (570, 205), (590, 205)],
    [(740, 105), (780, 105)],
    [(740, 205), (780, 205)],
    [(855, 130), (855, 180)],
    [(170, 255), (210, 255)],
    [(285, 180), (285, 230)],
    [(95, 280), (95, 296), (475, 296), (475, 280)],
]


def draw() -> str:
    shapes = [path(flow, "flow") for flow in FLOWS]
    for name, (x, y, content) in BOXES.items():
        shapes += [
            box(x, y, 150, 50),
            label(x + 75, y + 22, name, "middle"),
            label(x + 75, y + 40, content, "small middle"),
        ]
    shapes += [
        box(20, 310, 910, 34, "load"),
        label(475, 332, "workflow joins these steps; cli reads arguments, calls workflow and prints", "middle"),
    ]
    return picture(950, 360, "Data flow between the packages of fifthwheel", shapes)
