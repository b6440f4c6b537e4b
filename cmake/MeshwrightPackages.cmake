# SPDX-License-Identifier: Apache-2.0
# Debian packages ("cpack -G DEB" in a build folder, or scripts/package): meshwright, meshwright-server, libmeshwright-dev,
# and meshwright-dashboard where the dashboard was built. dpkg-shlibdeps says what the programs depend on.

set(documentation ${CMAKE_INSTALL_DATADIR}/doc)
set(made ${PROJECT_BINARY_DIR}/packages)

# The page: built at packaging time or not at all.
set(components cli server dev)
if(EXISTS ${PROJECT_SOURCE_DIR}/dashboard/dist/index.html)
  list(APPEND components dashboard)
endif()
set(package_of_cli meshwright)
set(package_of_server meshwright-server)
set(package_of_dev libmeshwright-dev)
set(package_of_dashboard meshwright-dashboard)

# Debian wants both changelogs, compressed without a time, so that packages of one source are equal.
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
file(STRINGS ${PROJECT_SOURCE_DIR}/CHANGELOG.md release REGEX "^## ${PROJECT_VERSION} ")
if(release MATCHES "([0-9]+-[0-9]+-[0-9]+)")
  set(release_date ${CMAKE_MATCH_1})
else()
  message(FATAL_ERROR "CHANGELOG.md has no \"## ${PROJECT_VERSION} (YYYY-MM-DD)\"")
endif()
find_program(MW_GZIP gzip)
if(MW_GZIP)
  execute_process(COMMAND date -u -R -d ${release_date} OUTPUT_VARIABLE date OUTPUT_STRIP_TRAILING_WHITESPACE)
  set(CPACK_PACKAGE_CONTACT "Meshwright developers <developers@meshwright.example>")
  file(WRITE ${made}/changelog.Debian "meshwright (${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}) unstable; urgency=medium

  * Release ${PROJECT_VERSION}: /usr/share/doc/meshwright/changelog.gz has what changed.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}
")
  configure_file(${PROJECT_SOURCE_DIR}/CHANGELOG.md ${made}/changelog COPYONLY)
  execute_process(COMMAND ${MW_GZIP} -9nkf ${made}/changelog.Debian ${made}/changelog)
endif()

foreach(page meshwright meshwright-coordinator meshwright-worker)
  set(component server)
  if(page STREQUAL "meshwright")
    set(component cli)
  endif()
  set(manual ${PROJECT_SOURCE_DIR}/docs/man/${page}.1)
  if(MW_GZIP)
    configure_file(${manual} ${made}/${page}.1 COPYONLY)
    execute_process(COMMAND ${MW_GZIP} -9nkf ${made}/${page}.1)
    set(manual ${made}/${page}.1.gz)
  endif()
  install(FILES ${manual} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT ${component})
endforeach()

foreach(component IN LISTS components)
  set(folder ${documentation}/${package_of_${component}})
  install(FILES ${PROJECT_SOURCE_DIR}/deploy/debian/copyright DESTINATION ${folder} COMPONENT ${component})
  if(MW_GZIP)
    install(FILES ${made}/changelog.gz ${made}/changelog.Debian.gz DESTINATION ${folder} COMPONENT ${component})
  endif()
endforeach()
# Files of the system: outside any prefix, so a plain --install leaves them out.
install(FILES ${PROJECT_SOURCE_DIR}/deploy/systemd/meshwright-coordinator.service
  ${PROJECT_SOURCE_DIR}/deploy/systemd/meshwright-worker.service
  DESTINATION /lib/systemd/system COMPONENT server EXCLUDE_FROM_ALL)
install(FILES ${PROJECT_SOURCE_DIR}/deploy/systemd/coordinator.conf ${PROJECT_SOURCE_DIR}/deploy/systemd/worker.conf
  DESTINATION /etc/meshwright COMPONENT server EXCLUDE_FROM_ALL)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME meshwright)
set(CPACK_PACKAGE_VENDOR Meshwright)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_COMPONENTS_ALL ${components})
set(CPACK_COMPONENTS_GROUPING IGNORE)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

# dpkg's "Description": a line of what it is, then lines of why.
set(method "It grows surfaces camera by camera (Jancosek, Shekhovtsov, Pajdla: Scalable
Multi-View Stereo, 2009), so that effort follows the surface and memory does
not follow the number of photographs.")
set(CPACK_DEBIAN_CLI_PACKAGE_NAME meshwright)
set(CPACK_DEBIAN_CLI_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_CLI_PACKAGE_RECOMMENDS "meshwright-dashboard, colmap")
set(CPACK_COMPONENT_CLI_DESCRIPTION "turn photographs into a triangle mesh\n${method}")
set(CPACK_DEBIAN_SERVER_PACKAGE_NAME meshwright-server)
set(CPACK_DEBIAN_SERVER_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_SERVER_PACKAGE_RECOMMENDS "meshwright-dashboard, colmap")
set(CPACK_DEBIAN_SERVER_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/deploy/debian/server/conffiles
  ${PROJECT_SOURCE_DIR}/deploy/debian/server/postinst ${PROJECT_SOURCE_DIR}/deploy/debian/server/prerm
  ${PROJECT_SOURCE_DIR}/deploy/debian/server/postrm)
set(CPACK_COMPONENT_SERVER_DESCRIPTION "multi-view stereo as a service: coordinator and worker
The coordinator decides which camera is processed next and makes the mesh; any
number of workers on any machines do the processing. Both come as systemd
units, which are started by the administrator: systemctl enable --now
meshwright-coordinator meshwright-worker.")
set(CPACK_DEBIAN_DEV_PACKAGE_NAME libmeshwright-dev)
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_SHLIBDEPS OFF)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "libabsl-dev, libeigen3-dev (>= 3.4), libexpat1-dev, libhwy-dev, libjpeg-dev, libmeshoptimizer-dev, \
libpng-dev, libqhull-dev, libsqlite3-dev, libssl-dev, zlib1g-dev")
set(CPACK_COMPONENT_DEV_DESCRIPTION "multi-view stereo as a C++ library
Headers, the static library and the CMake package Meshwright: a reconstruction
in the process of another program.")
set(CPACK_DEBIAN_DASHBOARD_PACKAGE_NAME meshwright-dashboard)
set(CPACK_DEBIAN_DASHBOARD_PACKAGE_SECTION web)
set(CPACK_DEBIAN_DASHBOARD_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_DASHBOARD_PACKAGE_SHLIBDEPS OFF)
set(CPACK_COMPONENT_DASHBOARD_DESCRIPTION "multi-view stereo as a service: the web page
What meshwright up and the coordinator of meshwright-server show in a browser:
the mesh in 3D as it grows, its cameras, the workers.")
include(CPack)
