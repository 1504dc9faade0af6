# What `cmake --install` puts where, and the Debian packages that CPack makes of it:
#   sightline                 component runtime: daemon, command, documents
#   libsightline-client-dev   component client: the C++ client library, its headers and the contract
include(GNUInstallDirs)
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)
set(third_parties ${PROJECT_BINARY_DIR}/third-parties.txt)
find_program(PYTHON_PROGRAM NAMES python3 PATHS /usr/bin REQUIRED)
add_custom_command(OUTPUT ${third_parties}
                   COMMAND ${PYTHON_PROGRAM} -B ${CMAKE_CURRENT_LIST_DIR}/third_parties.py ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR} ${third_parties}
                           $<TARGET_FILE:sightlined> $<TARGET_FILE:sightline>
                   DEPENDS sightlined sightline ${CMAKE_CURRENT_LIST_DIR}/third_parties.py ${CMAKE_CURRENT_LIST_DIR}/parties.py
                   COMMENT "Listing the third parties of what is linked" VERBATIM)
add_custom_target(third_parties ALL DEPENDS ${third_parties})
# OpenGL is loaded at run time, so the linker does not know it.
set(recommended "libegl1, libopengl0, libegl-mesa0, libgl1-mesa-dri")
set(sbom ${PROJECT_BINARY_DIR}/sbom.spdx.json)
add_custom_command(OUTPUT ${sbom}
                   COMMAND ${PYTHON_PROGRAM} -B ${CMAKE_CURRENT_LIST_DIR}/sbom.py ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR} ${sbom}
                           $<TARGET_FILE:sightlined> $<TARGET_FILE:sightline> --optional "${recommended}"
                   DEPENDS sightlined sightline ${CMAKE_CURRENT_LIST_DIR}/sbom.py ${CMAKE_CURRENT_LIST_DIR}/parties.py
                   COMMENT "Bill of materials" VERBATIM)
add_custom_target(sbom ALL DEPENDS ${sbom})

# Manual pages, completions of shells and the page about flags, from the programs' own tables of flags. A build for other machines cannot run
# the programs, so it has none.
if(NOT CMAKE_CROSSCOMPILING)
  set(command_line ${PROJECT_BINARY_DIR}/generated/command-line)
  add_custom_command(OUTPUT ${command_line}/COMMAND_LINE.md
                     COMMAND ${PYTHON_PROGRAM} ${CMAKE_CURRENT_LIST_DIR}/command_line.py ${command_line} $<TARGET_FILE:sightlined> $<TARGET_FILE:sightline>
                     DEPENDS sightlined sightline ${CMAKE_CURRENT_LIST_DIR}/command_line.py
                     COMMENT "Manual pages and completions" VERBATIM)
  add_custom_target(command_line ALL DEPENDS ${command_line}/COMMAND_LINE.md)
  install(FILES ${command_line}/man/sightline.1.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT runtime)
  install(FILES ${command_line}/man/sightlined.8.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man8 COMPONENT runtime)
  install(DIRECTORY ${command_line}/completions/bash/ DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT runtime)
  install(DIRECTORY ${command_line}/completions/zsh/ DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT runtime)
  install(DIRECTORY ${command_line}/completions/fish/ DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT runtime)
endif()

install(TARGETS sightlined sightline RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT runtime)
install(FILES ${third_parties} ${sbom} DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)
install(FILES ${PROJECT_SOURCE_DIR}/deploy/CHANGELOG.md ${PROJECT_SOURCE_DIR}/deploy/COMPATIBILITY.md DESTINATION ${CMAKE_INSTALL_DOCDIR}
        COMPONENT runtime)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/proto/sightline DESTINATION ${CMAKE_INSTALL_DATADIR}/sightline/proto COMPONENT client
        FILES_MATCHING PATTERN "*.proto")

# What Debian asks of each package: its copyright, and its changelog in Debian's format.
find_program(GZIP_PROGRAM gzip REQUIRED)
set(debian ${PROJECT_BINARY_DIR}/debian)
foreach(pair "runtime;sightline" "client;libsightline-client-dev")
  list(GET pair 0 component)
  list(GET pair 1 package)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/changelog.in ${debian}/${package}/changelog @ONLY)
  execute_process(COMMAND ${GZIP_PROGRAM} -9nkf ${debian}/${package}/changelog COMMAND_ERROR_IS_FATAL ANY)
  install(FILES ${debian}/${package}/changelog.gz ${CMAKE_CURRENT_LIST_DIR}/copyright DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package}
          COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME sightline)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT "Sightline developers <maintainers@sightline.invalid>")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_STRIP_FILES TRUE)
set(CPACK_COMPONENTS_ALL runtime client)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_NAME sightline)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "camera control for games over gRPC")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SECTION net)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_RECOMMENDS "${recommended}")
set(CPACK_DEBIAN_RUNTIME_DESCRIPTION "The daemon sightlined steers game cameras so that several targets
stay visible. The command sightline records, replays, evaluates and loads it.")
set(CPACK_DEBIAN_CLIENT_PACKAGE_NAME libsightline-client-dev)
set(CPACK_DEBIAN_CLIENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_CLIENT_PACKAGE_DEPENDS "libgrpc++-dev, libprotobuf-dev, libexpected-dev")
set(CPACK_DEBIAN_CLIENT_DESCRIPTION "The C++ client library of Sightline with a CMake package and a
pkg-config file, and the contract as .proto files for other languages.")
include(CPack)

# `cmake --build <build> --target packages`: the packages, in packages/ of the build. It builds what they hold and no tests.
add_custom_target(packages COMMAND ${CMAKE_CPACK_COMMAND} --config ${PROJECT_BINARY_DIR}/CPackConfig.cmake
                  DEPENDS sightlined sightline sightline_client third_parties sbom $<TARGET_NAME_IF_EXISTS:command_line> WORKING_DIRECTORY ${PROJECT_BINARY_DIR} VERBATIM)
