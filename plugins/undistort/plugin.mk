undistort_CFLAGS := -isystem /usr/include/opencv4
undistort_LIBS := -lopencv_core -lopencv_imgproc
