"""The published results robotrue was built on, repeated on simulated arms, one package a source.

No part of the product: nothing in ``robotrue`` imports it but the commands that print it,
``reproduce`` and the simulated ``slot-test``.
"""
