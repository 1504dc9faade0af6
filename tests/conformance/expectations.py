"""Compares an answer with what a session expects."""
import math

TOLERANCE = 1e-6  # of numbers: relative, and absolute near 0


def unmet(expected, answer, path=""):
    """The differences, as sentences. An expected object lists the fields that count; a field that is absent has its default."""
    if expected is None:
        return [] if answer is None else [f"{path}: expected to be absent, got {answer}"]
    if isinstance(expected, dict):
        return _unmet_object(expected, answer, path)
    if isinstance(expected, list):
        answer = answer or []
        if len(expected) != len(answer):
            return [f"{path}: expected {len(expected)} elements, got {len(answer)}"]
        return [trouble for i, (one, other) in enumerate(zip(expected, answer)) for trouble in unmet(one, other, f"{path}[{i}]")]
    if answer is None:  # JSON leaves defaults out
        answer = type(expected)() if isinstance(expected, (bool, int, float)) else ("0" if str(expected).isdigit() else "")
    if isinstance(expected, (int, float)) and not isinstance(expected, bool):
        is_met = math.isclose(float(answer), expected, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
    else:
        is_met = type(expected) is type(answer) and expected == answer
    return [] if is_met else [f"{path}: expected {expected!r}, got {answer!r}"]


def _unmet_object(expected, answer, path):
    rule = next(iter(expected), None)
    if rule in RULES:
        return [] if RULES[rule](expected[rule], answer) else [f"{path}: expected {expected}, got {answer!r}"]
    if not isinstance(answer, dict) and answer is not None:
        return [f"{path}: expected {expected}, got {answer!r}"]
    fields = answer or {}
    if set(expected) == set("xyzw"):  # a rotation, which its negative equals
        signs = [[] if not (trouble := _fields(expected, {k: s * v for k, v in fields.items()}, path)) else trouble for s in (1, -1)]
        return min(signs, key=len)
    return _fields(expected, fields, path)


def _fields(expected, fields, path):
    return [trouble for name, value in expected.items() for trouble in unmet(value, fields.get(name), f"{path}.{name}")]


def _length_at_most(limit, vector):
    return math.hypot(*(vector or {}).values()) <= limit


RULES = {
    "above": lambda least, answer: isinstance(answer, str) and int(answer) > int(least),
    "atLeast": lambda least, answer: isinstance(answer, str) and int(answer) >= int(least),
    "between": lambda ends, answer: isinstance(answer or 0, (int, float)) and ends[0] <= (answer or 0) <= ends[1],
    "contains": lambda part, answer: isinstance(answer, str) and part in answer,
    "lengthAtMost": _length_at_most,
}
