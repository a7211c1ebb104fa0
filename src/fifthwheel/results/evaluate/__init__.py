"""Evaluation of a measured log by a test method of ISO: measures with sigma, conditions of the test, diagrams.

A test method is a row of `METHODS`, with a function of a `MeasuredMotion` that gives `MethodResult`.
"""

from fifthwheel.results.evaluate.curves import ComparedCurve
from fifthwheel.results.evaluate.evaluate import METHODS, Method, evaluate
from fifthwheel.results.evaluate.evaluation import Condition, EvaluatedMeasure, Evaluation
from fifthwheel.results.evaluate.validation import ComparedMeasure, Validation, validate

__all__ = [
    "METHODS",
    "ComparedCurve",
    "ComparedMeasure",
    "Condition",
    "EvaluatedMeasure",
    "Evaluation",
    "Method",
    "Validation",
    "evaluate",
    "validate",
]
