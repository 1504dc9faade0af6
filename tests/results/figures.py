"""Tables of figures: reading them, taking means over seeds, and writing numbers as text."""
import csv
import math
import statistics


def read_table(path):
    """The rows of a CSV file; a cell is a float where it reads as one, None where it is empty, else text."""
    with open(path, newline="", encoding="utf-8") as file:
        return [{name: _value(cell) for name, cell in row.items()} for row in csv.DictReader(file)]


def write_table(path, columns, rows):
    """Numbers have six significant digits, which keeps the table small; the page is made from the written table."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in rows:
            writer.writerow([_cell(row[name]) for name in columns])


def find(rows, **wanted):
    """The first row with these values, or None."""
    return next(iter(select(rows, **wanted)), None)


def select(rows, **wanted):
    return [row for row in rows if all(row.get(name) == value for name, value in wanted.items())]


def distinct(rows, name):
    """The distinct values of a column, in the order of their first row."""
    return list(dict.fromkeys(row[name] for row in rows))


def mean(rows, name):
    """The mean over the rows that have the figure; None when no row has it."""
    values = [row[name] for row in rows if row.get(name) is not None]
    return sum(values) / len(values) if values else None


def weighted_mean(rows, name, weight):
    """The mean with each row weighted by its column `weight`; None when all weights are 0."""
    pairs = [(row[name], row[weight]) for row in rows if row.get(name) is not None and row.get(weight)]
    total = sum(count for _, count in pairs)
    return sum(value * count for value, count in pairs) / total if total else None


def of_shared_seeds(some_rows, other_rows):
    """Both lists without the rows whose seed the other lacks."""
    seeds = {row["seed"] for row in some_rows} & {row["seed"] for row in other_rows}
    return tuple([row for row in rows if row["seed"] in seeds] for rows in (some_rows, other_rows))


def greatest(rows, name):
    """The greatest value of the rows that have the figure; None when no row has it."""
    return max((row[name] for row in rows if row.get(name) is not None), default=None)


def total(rows, name):
    return sum(row.get(name) or 0 for row in rows)


def standard_error(values):
    """Of the mean; 0 for a single value."""
    return statistics.stdev(values) / math.sqrt(len(values)) if len(values) > 1 else 0.0


def number(value, digits):
    if value is None:
        return ""
    return "∞" if math.isinf(value) else f"{value:.{digits}f}"


def percent(share, digits=2):
    return "" if share is None else f"{100 * share:.{digits}f} %"


def between(least, most, digits, scale=1.0):
    """A spread " (least to most)", or "" when both read the same."""
    if least is None or most is None:
        return ""
    low, high = number(scale * least, digits), number(scale * most, digits)
    return "" if low == high else f" ({low} to {high})"


def over_seeds(row, name, digits, scale=1.0):
    """Median and spread of a figure in the paper's tables."""
    if row[name + "_median"] is None:
        return ""
    return number(scale * row[name + "_median"], digits) + between(row[name + "_least"], row[name + "_most"], digits, scale)


def markdown(head, rows):
    """A Markdown table. A column whose name begins with < is aligned left, the others right."""
    names = [name.lstrip("<") for name in head]
    rule = ["---" if name.startswith("<") else "--:" for name in head]
    lines = [names, rule] + [[str(cell) for cell in row] for row in rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def image(name, words):
    return f"![{words}](plots/{name})\n"


def _value(cell):
    if cell is None or cell == "":
        return None
    try:
        return float(cell)
    except ValueError:
        return cell


def _cell(value):
    if value is None:
        return ""
    return f"{value:.6g}" if isinstance(value, float) else value
