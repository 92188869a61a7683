"""The arithmetic of the layers in compiled form: loops over one row, chunk or path at a time.

Every kernel treats each of its rows alone and in one order, without threads and without a
reassociation of sums, so that an answer depends neither on the batch nor on the machine's load.
`genpolicy.robot` says the same in numpy and is what tests and `benchmarks/feasibility` hold these
against.
"""
