"""The arithmetic of a network evaluation in compiled form, with the bits of torch's products.

A sum is taken in the order in which the matrix library takes it, so that nothing but time depends
on who computes. That order is no promise: `policies.compiled_network` tries it before it is used.
"""
