flow_CFLAGS := -isystem /usr/include/opencv4
flow_LIBS := -lopencv_core -lopencv_imgproc -lopencv_video
