# What the test programs link beside core and the plugin of their own name.
# Calculations that take minutes under a sanitizer; test_calibrate_run runs the same code under the
# address sanitizer.
slow_tests := calibrate $(if $(filter thread,$(SAN)),calibrate_run)
valgrind_tests := image:* edges:*tiny* segments:any_size
test-parts: $(B)/report
bench_runtime_PKGS := gstreamer-1.0
fuzz_decode_uses := image
fuzz_scene_uses := scene
fuzz_state_uses := lcm
fuzz_picture_uses := lcm
fuzz_command_uses := robot
fuzz_adjust_uses := adjust files
fuzz_ack_LIBS := -llcm

test_network_uses := lcm

# The runtime's tests load plugins and preload a library that are made for them. Their stages call
# the runtime that the test itself is linked with.
test_core_LIBS := -rdynamic
test_sequence_LIBS := -rdynamic
test_pictures_LIBS := -rdynamic
test_shared := $(patsubst %.c,$(B)/%.so,$(wildcard tests/plugins/*.c tests/preload/*.c))
test-parts: $(test_shared)
$(test_shared): $(B)/tests/%.so: $(B)/obj/tests/%.c.o
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CC) -shared -o $@ $< $(ldflags) -ldl

test_guide_uses := edges segments
test_window_uses := adjust files
test_segments_uses := edges
test_beside_uses := segments reconstruct
test_memory_uses := reconstruct
test_adjust_board_uses := adjust calibrate image files
test_adjust_noise_uses := adjust files
bench_adjust_uses := adjust files
bench_accuracy_uses := edges segments
bench_edges_uses := edges segments
bench_scene_uses := edges scene
bench_edges_CFLAGS := -isystem /usr/include/opencv4 -Wno-missing-field-initializers -Wno-conversion
bench_edges_LIBS := -lopencv_core -lopencv_imgproc -lopencv_ximgproc
bench_edges_PKGS := libpng
test_calibrate_run_uses := calibrate image files

test_pixels_uses := camera
test_pixels_PKGS := libturbojpeg
test_live_uses := camera
test_live_PKGS := libturbojpeg
test_usb_CFLAGS := -Itests
bench_pixels_uses := camera
bench_pixels_PKGS := libturbojpeg
fuzz_uvc_uses := usb camera

bench_chain_uses := image
$(B)/bench/bench_chain: $(patsubst %,$(B)/obj/%.o,$(wildcard samples/experiments/common/*.c)) \
        | $(B)/bench/plugins/rival.so
rival_CFLAGS := -isystem /usr/include/opencv4 -Wno-missing-field-initializers
$(B)/bench/plugins/rival.so: $(B)/obj/tests/bench/plugins/rival.cc.o $(B)/lib/libarris.so.1
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CXX) -shared -o $@ $< -L$(B)/lib -larris $(ldflags) -lopencv_core -lopencv_imgproc

bench_ceres_uses := adjust files
bench_ceres_CFLAGS := -isystem /usr/include/eigen3
bench_ceres_LIBS := -lceres -lglog
