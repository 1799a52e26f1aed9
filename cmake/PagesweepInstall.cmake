# What `cmake --install` puts where, and the package that find_package(pagesweep) then finds.
include(CMakePackageConfigHelpers)
get_property(libraries GLOBAL PROPERTY PAGESWEEP_LIBRARIES)
set(package_directory ${CMAKE_INSTALL_LIBDIR}/cmake/pagesweep)

# What most programs want: the whole way from frames to pages, and the files around it.
add_library(pagesweep_all INTERFACE)
add_library(pagesweep::pagesweep ALIAS pagesweep_all)
set_target_properties(pagesweep_all PROPERTIES EXPORT_NAME pagesweep)
target_link_libraries(pagesweep_all INTERFACE pagesweep_pipeline)

install(TARGETS pagesweep_all ${libraries} EXPORT pagesweep ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT pagesweep NAMESPACE pagesweep:: FILE pagesweepTargets.cmake DESTINATION ${package_directory})
install(DIRECTORY src/pagesweep TYPE INCLUDE FILES_MATCHING PATTERN "*.h" REGEX "_(internal|testing)\\.h$" EXCLUDE)

configure_package_config_file(cmake/pagesweepConfig.cmake.in pagesweepConfig.cmake
                              INSTALL_DESTINATION ${package_directory})
write_basic_package_version_file(pagesweepConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/pagesweepConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/pagesweepConfigVersion.cmake
        DESTINATION ${package_directory})
install(FILES LICENSE README.md TYPE DOC)
