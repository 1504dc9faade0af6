"""A reader of Prometheus's text format, for tests: {family: Family}."""
import collections
import re
import urllib.error
import urllib.request

Family = collections.namedtuple("Family", "kind help samples")  # samples: {(name, ((label, value), ...)): number}
SAMPLE = re.compile(r'^([a-zA-Z_:][\w:]*)(?:\{(.*)\})? (\S+)$')
LABEL = re.compile(r'([a-zA-Z_]\w*)="((?:[^"\\]|\\.)*)"')


def parse(text):
    families = {}
    for line in text.splitlines():
        if line.startswith("# HELP "):
            _, _, name, help_text = line.split(" ", 3)
            families[name] = Family(None, help_text, {})
        elif line.startswith("# TYPE "):
            _, _, name, kind = line.split(" ", 3)
            families[name] = families[name]._replace(kind=kind)
        elif line:
            name, labels, value = SAMPLE.match(line).groups()
            family = name if name in families else re.sub(r"_(bucket|sum|count)$", "", name)
            key = (name, tuple(sorted(LABEL.findall(labels or ""))))
            assert key not in families[family].samples, "twice: " + line
            families[family].samples[key] = float(value)
    return families


def value(families, name, **labels):
    """The number of one sample."""
    family = name if name in families else re.sub(r"_(bucket|sum|count)$", "", name)
    return families[family].samples[(name, tuple(sorted(labels.items())))]


def get(address, path, method="GET"):
    """(status, text) of a page."""
    try:
        with urllib.request.urlopen(urllib.request.Request(f"http://{address}{path}", method=method), timeout=10) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def scrape(address):
    status, text = get(address, "/metrics")
    assert status == 200, text
    return parse(text)
