"""Times as tables and messages show them."""


def in_words(seconds: float) -> str:
    """Return a time as people say it.

    >>> in_words(42), in_words(200), in_words(20000)
    ('42 s', '3 min', '5.6 h')
    """
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
