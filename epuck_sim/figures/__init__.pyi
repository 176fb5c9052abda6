from .sweep_figure import plot

__all__ = ["plot"]
