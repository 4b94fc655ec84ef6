"""Hard cases: inputs on which formulas as printed fail, each with its exact answer and the error found.

:func:`bench.hard.cases.measure` runs all of them; ``app.py bench --hard`` prints the table.
"""
