# The kernels' loops are plain C that the compiler vectorises.
edges_CFLAGS := -O3 -fno-math-errno -fno-trapping-math -fno-tree-slp-vectorize
