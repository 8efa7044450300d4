"""The use cases: one request, one function and one result for every operation of the product.

Commands, jobs, HTTP bodies, forms and the reference are made from the requests. Nothing here
prints: an operation reports to its context and returns values.
"""
