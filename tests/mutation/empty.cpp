// CMake makes precompiled headers for a target that has a source file only. This is that file.
