"""Deng, Gao, Ma, Lu 2022: transfer of a learned error from one region to the next."""
