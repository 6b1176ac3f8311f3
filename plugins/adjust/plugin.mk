# The kernels' loops are plain C that the compiler vectorises. Under a sanitizer Eigen's templates
# take long to compile with all that the rest has.
adjust_CFLAGS := -isystem /usr/include/eigen3 -fno-math-errno -fno-trapping-math $(if $(SAN),-O1 -g1,-O3)
adjust_LIBS := -lcholmod
adjust_PKGS := jansson
adjust_uses := files
