corners_CFLAGS := -isystem /usr/include/opencv4
corners_LIBS := -lopencv_core -lopencv_imgproc
