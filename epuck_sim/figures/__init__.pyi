from .on_axes import contour_map, curves, deviations, order_parameters, perturbation, series, violins

__all__ = ["contour_map", "curves", "deviations", "order_parameters", "perturbation", "series", "violins"]
