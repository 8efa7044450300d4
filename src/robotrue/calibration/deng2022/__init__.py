"""The transfer-learning method of Deng et al. 2022, as printed and as it can work.

Source: Deng, Gao, Ma, Lu 2022, Journal of Mechanical Engineering 58(14), 170-178. Equation and
table numbers in this package are the paper's. Where an equation can be read two ways, the reading
is a named switch of :class:`robotrue.calibration.deng2022.readings.Readings`.
"""
