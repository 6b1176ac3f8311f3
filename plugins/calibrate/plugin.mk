# Under a sanitizer Eigen's templates take minutes to compile with all that the rest has.
calibrate_CFLAGS := -isystem /usr/include/opencv4 -isystem /usr/include/eigen3 $(if $(SAN),-O1 -g1)
calibrate_PKGS := jansson
calibrate_LIBS := -lopencv_core -lopencv_imgproc -lopencv_calib3d
calibrate_uses := image files
