"""Numbers, estimates and times as tables show them."""


def in_digits(value: float) -> str:
    """Return a number of cycles with four digits, or with all digits before the point if they are more.

    >>> in_digits(12345.6), in_digits(47.0271)
    ('12346', '47.03')
    """
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def format_estimate(value: float | None, low: float | None, high: float | None) -> str:
    """Return an estimate with its interval; the value is None if it is undetermined, an end if it is not reached.

    >>> format_estimate(47.0, 40.1, None), format_estimate(47.0, None, None), format_estimate(None, None, None)
    ('47 (40.1 to ?)', '47', '-')
    """
    if value is None or low is None:
        return "-" if value is None else in_digits(value)
    return f"{in_digits(value)} ({in_digits(low)} to {'?' if high is None else in_digits(high)})"


def in_words(seconds: float) -> str:
    """Return a time as people say it.

    >>> in_words(42), in_words(200), in_words(20000)
    ('42 s', '3 min', '5.6 h')
    """
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
