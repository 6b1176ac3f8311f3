# The drivers against a real kernel: what runs in the guest of boot.sh.
packages_vm := $(packages_build) qemu-system-x86 busybox-static cpio kmod xz-utils v4l-utils

# Where the packages cannot be had, run.sh says that the test is skipped, and why.
test-vm test-vm-cycles:
	-@$(MAKE) --no-print-directory setup-vm
	@$(MAKE) --no-print-directory run-$(@:test-%=%)
run-vm: all $(addprefix $(B)/tests/vm/,parts.so usbcam pad cycles)
	@B=$(B) tests/vm/run.sh
run-vm-cycles: $(B)/tests/vm/usbcam
	@$(MAKE) --no-print-directory vm-cycles B=$(B)/asan SAN=address,undefined
	@$(MAKE) --no-print-directory vm-cycles B=$(B)/tsan SAN=thread
	@for sanitizer in asan tsan; do B=$(B) tests/vm/run.sh cycles $$sanitizer || exit 1; done
vm-cycles: $(B)/tests/vm/cycles $(addprefix $(B)/lib/arris/,v4l2.stages usb.stages)

$(B)/tests/vm/parts.so: $(call obj,tests/vm/parts.c) $(call kernel_obj,image) $(B)/common.a $(B)/lib/libarris.so.1
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CC) -shared -o $@ $(filter %.o %.a,$^) -L$(B)/lib -larris $(ldflags) \
	    $(call pkg_libs,image) $(call pkg_libs,common) -lm
$(B)/tests/vm/pad: $(call obj,tests/vm/pad.c) $(call kernel_obj,image) $(B)/common.a $(B)/libarris.a
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CC) -o $@ $^ $(ldflags) $(call pkg_libs,image) $(call pkg_libs,common) -lm -lpthread -ldl
$(B)/tests/vm/usbcam: $(call obj,tests/vm/usbcam.c tests/vm/usbcam_control.c)
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CC) -o $@ $^ $(ldflags) $(call pkg_libs,image)
$(B)/tests/vm/cycles: $(call obj,tests/vm/cycles.c) $(B)/lib/libarris.so.1
	@mkdir -p $(@D)
	$(call say,MAKE,$@)
	$(Q)$(CC) -o $@ $^ $(ldflags) -Wl,-rpath,'$$ORIGIN/lib' -lpthread
