"""Machine code of kernels on disk, and its execution in a process without the compiler.

Numba and LLVM take 70 MB and half a second of every process that imports them. A process whose
kernels are all stored does without: numba compiles (``mavlink_io.jit_numba``) and stores the object
file of each kernel here, and ``mavlink_io.jit_stored`` places it in memory.
"""
