"""Building blocks of the simulators: Warp functions of floats, vectors, arrays and structs.

They do no input or output, have no global state and know neither worlds nor methods.
"""
