# What `cmake --install <build> --component client` installs: the client library with its headers, a CMake package and a pkg-config file.
include(GNUInstallDirs)
set(headers ${CMAKE_INSTALL_INCLUDEDIR}/sightline)
install(TARGETS sightline_client sightline_proto sightline_error COMPONENT client ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(FILES sightline_client.h camera.h live_camera.h pose_sampler.h DESTINATION ${headers}/client/cpp COMPONENT client)
install(FILES ${PROJECT_SOURCE_DIR}/server/base/error.h DESTINATION ${headers}/server/base COMPONENT client)
install(DIRECTORY ${PROJECT_BINARY_DIR}/proto/ DESTINATION ${headers} COMPONENT client FILES_MATCHING PATTERN "*.pb.h" PATTERN CMakeFiles EXCLUDE
        PATTERN foxglove EXCLUDE)

include(CMakePackageConfigHelpers)
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/sightline)
configure_package_config_file(sightline-config.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/sightline-config.cmake INSTALL_DESTINATION ${package}
                              PATH_VARS CMAKE_INSTALL_INCLUDEDIR CMAKE_INSTALL_LIBDIR)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/sightline-config-version.cmake COMPATIBILITY SameMinorVersion)
configure_file(sightline-client.pc.in ${CMAKE_CURRENT_BINARY_DIR}/sightline-client.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/sightline-config.cmake ${CMAKE_CURRENT_BINARY_DIR}/sightline-config-version.cmake
        DESTINATION ${package} COMPONENT client)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/sightline-client.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT client)
