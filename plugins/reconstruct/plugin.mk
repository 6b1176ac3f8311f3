reconstruct_CFLAGS := -O3 -fno-math-errno -fno-trapping-math
