# What the test programs link beside core and the plugin of their own name.
valgrind_tests :=
test-parts:
