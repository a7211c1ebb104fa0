"""Evaluation of a measured log by a test method of ISO: measures with sigma, conditions of the test, diagrams.

A test method is a function of a `Motion` that gives `Findings`, one module each; `METHODS` lists them.
"""

from fifthwheel._callable import make_callable
from fifthwheel.evaluate.evaluate import METHODS, Method, evaluate
from fifthwheel.evaluate.evaluation import Condition, EvaluatedMeasure, Evaluation

__all__ = ["METHODS", "Condition", "EvaluatedMeasure", "Evaluation", "Method", "evaluate"]

make_callable(__name__, evaluate)
