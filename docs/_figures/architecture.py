"""Draws docs/_static/architecture.svg: the data flow between the packages."""

from svg import box, label, path, picture

ROOMS = {  # name: (x, y, what it does)
    "logs": (20, 30, "files to records"),
    "checks, time_bases": (360, 30, "faults of signals"),
    "truck": (20, 120, "files, published values"),
    "dynamics": (360, 120, "equations of motion"),
    "filters, native": (530, 120, "Kalman steps, compiled"),
    "stream, observe": (700, 120, "states"),
    "report, pages": (870, 120, "tables, plots, words"),
    "manoeuvres": (20, 210, "what is driven"),
    "simulate, plant": (190, 210, "linear, nonlinear truck"),
    "identify": (530, 210, "parameters, verdicts"),
    "diagnose, assess": (870, 210, "advice, performance"),
}
DATA = {  # what crosses the borders
    "Record": (190, 30, "signals, one time base"),
    "Vehicle": (190, 120, "numbers and sigmas"),
    "Setup": (360, 210, "unknowns and model"),
    "Identification": (700, 210, "the result, data only"),
}
FLOWS = [
    [(160, 55), (190, 55)],
    [(330, 55), (360, 55)],
    [(345, 55), (345, 235), (360, 235)],
    [(160, 145), (190, 145)],
    [(330, 145), (360, 145)],
    [(430, 120), (430, 80)],
    [(430, 170), (430, 210)],
    [(500, 145), (530, 145)],
    [(600, 170), (600, 210)],
    [(670, 145), (700, 145)],
    [(840, 145), (870, 145)],
    [(160, 235), (190, 235)],
    [(190, 222), (175, 222), (175, 68), (190, 68)],
    [(500, 235), (530, 235)],
    [(670, 235), (700, 235)],
    [(770, 210), (770, 170)],
    [(840, 235), (870, 235)],
    [(940, 210), (940, 170)],
]
BARS = [
    "channels: of each measured quantity its unit, model, limits, noise, sensor errors and words; every layer reads it",
    "workflow joins the steps for live, app, fleet and cli; "
    "studies, cheng_cebon_2011 and export use the packages directly",
]


def draw() -> str:
    shapes = [path(flow, "flow") for flow in FLOWS]
    for boxes, kind in ((ROOMS, "box"), (DATA, "load")):
        for name, (x, y, content) in boxes.items():
            shapes += [
                box(x, y, 140, 50, kind),
                label(x + 70, y + 22, name, "middle"),
                label(x + 70, y + 40, content, "small middle"),
            ]
    for i, bar in enumerate(BARS):
        shapes += [box(20, 285 + 42 * i, 990, 32), label(515, 306 + 42 * i, bar, "middle")]
    return picture(1030, 380, "Data flow between the packages of fifthwheel", shapes)
