segments_CFLAGS := -O3
