"""The words of a comparison of identifications."""

from fifthwheel.diagnose.comparison import Comparison

EXPLANATION = (
    "Difference: from the first run, in units of the sigma of this difference. Beyond 2 sigma a difference is real "
    "with a probability of 95 %. Errors of vehicle file and model that both runs share cancel."
)


def headline(comparison: Comparison) -> str:
    """How many parameters differ by more than two sigma."""
    known = [(p.name, d.sigmas) for p in comparison.parameters for d in p.differences if d and d.sigmas is not None]
    clear = dict.fromkeys(name for name, sigmas in known if abs(sigmas) > 2)
    names = f": {', '.join(clear)}" if clear else ""
    count = len({name for name, _ in known})
    return f"{len(clear)} of {count} parameters differ from {comparison.runs[0]} by more than 2 sigma{names}."
