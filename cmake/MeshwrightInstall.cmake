# SPDX-License-Identifier: Apache-2.0
# cmake --install: the programs, the dashboard where it was built, and the library with its headers and CMake package.
# Components: cli, server, dashboard, dev. "server" also has files of the system (units, settings), which only the Debian
# packages take: a plain --install stays below its prefix.

install(TARGETS meshwright RUNTIME COMPONENT cli)
install(TARGETS meshwright-coordinator meshwright-worker RUNTIME COMPONENT server)
install(PROGRAMS ${PROJECT_SOURCE_DIR}/deploy/slurm/meshwright-slurm DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT server)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/dashboard/dist/ DESTINATION ${CMAKE_INSTALL_DATADIR}/meshwright/dashboard
  COMPONENT dashboard OPTIONAL)

# mw_collect_rooms(TARGET ROOMS EXTERNALS): the static libraries of rooms that TARGET needs, itself included, and the
# targets of other projects that they need.
function(mw_collect_rooms TARGET ROOMS EXTERNALS)
  set(rooms "")
  set(externals "")
  set(open ${TARGET})
  while(open)
    list(POP_FRONT open next)
    if(next IN_LIST rooms OR next STREQUAL "mw_compile_options")
      continue()
    endif()
    if(NOT next MATCHES "^mw_")
      list(APPEND externals ${next})
      continue()
    endif()
    get_target_property(type ${next} TYPE)
    if(type STREQUAL "STATIC_LIBRARY")
      list(APPEND rooms ${next})
      get_target_property(needed ${next} LINK_LIBRARIES)
    else()
      get_target_property(needed ${next} INTERFACE_LINK_LIBRARIES)
    endif()
    if(needed)
      list(APPEND open ${needed})
    endif()
  endwhile()
  list(REMOVE_DUPLICATES externals)
  set(${ROOMS} ${rooms} PARENT_SCOPE)
  set(${EXTERNALS} ${externals} PARENT_SCOPE)
endfunction()

# What other programs may include. Each compiles alone, with Abseil and Eigen and nothing else (tests/install).
set(public_headers
  common/base/files.h
  common/base/ids.h
  common/geometry/camera.h
  common/geometry/lens.h
  common/geometry/oriented_box.h
  common/geometry/rigid3.h
  common/mesh/ply.h
  common/mesh/triangle_mesh.h
  common/scene/formats/import.h
  common/scene/formats/import_options.h
  common/scene/scene.h
  pipeline/library/library.h
  pipeline/local/local_progress.h)

# One archive of all rooms that a reconstruction in one process needs. Objects that speak to a network have no part in
# that: without them nobody has to link libpq and libcurl.
mw_collect_rooms(mw_library rooms externals)
set(objects "")
foreach(room IN LISTS rooms)
  list(APPEND objects "$<FILTER:$<TARGET_OBJECTS:${room}>,EXCLUDE,/(postgres_|s3_|open_blob_store)[^/]*$>")
endforeach()
list(REMOVE_ITEM externals PostgreSQL::PostgreSQL CURL::libcurl nlohmann_json::nlohmann_json)
add_library(meshwright_library STATIC ${objects})
add_library(Meshwright::meshwright ALIAS meshwright_library)
set_target_properties(meshwright_library PROPERTIES
  OUTPUT_NAME meshwright EXPORT_NAME meshwright LINKER_LANGUAGE CXX)
target_compile_features(meshwright_library PUBLIC cxx_std_20)
target_sources(meshwright_library PUBLIC FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${public_headers})
target_link_libraries(meshwright_library
  PUBLIC absl::span absl::status absl::statusor Eigen3::Eigen
  PRIVATE ${externals})

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/Meshwright)
install(TARGETS meshwright_library EXPORT MeshwrightTargets
  ARCHIVE COMPONENT dev
  FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/meshwright COMPONENT dev)
install(EXPORT MeshwrightTargets NAMESPACE Meshwright:: DESTINATION ${package_folder} COMPONENT dev)
include(CMakePackageConfigHelpers)
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/MeshwrightConfig.cmake.in
  ${PROJECT_BINARY_DIR}/MeshwrightConfig.cmake INSTALL_DESTINATION ${package_folder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/MeshwrightConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/MeshwrightConfig.cmake ${PROJECT_BINARY_DIR}/MeshwrightConfigVersion.cmake
  DESTINATION ${package_folder} COMPONENT dev)
