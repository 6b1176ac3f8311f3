scene_PKGS := assimp lcm
# The kernels' loops are plain C that the compiler vectorises.
scene_CFLAGS := -O3 -fno-math-errno -fno-trapping-math
