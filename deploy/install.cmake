# install.cmake - what is installed beside the programs, and how it is removed again. Included by the
# top CMakeLists.txt. Programs look for each other beside themselves (base/program.h), so that an
# installed prefix may be moved.
include(GNUInstallDirs)

# Every prefix has the unit files with its own paths: the prefix is known when it is installed, not
# before (cmake --install --prefix).
install(CODE "
  file(READ \"${CMAKE_SOURCE_DIR}/deploy/systemd/heliod.service\" unit)
  string(REPLACE \"/usr/bin/heliod\" \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_BINDIR}/heliod\" unit \"\${unit}\")
  file(WRITE \"${CMAKE_BINARY_DIR}/install/heliod.service\" \"\${unit}\")
  file(INSTALL DESTINATION \"\${CMAKE_INSTALL_PREFIX}/lib/systemd/system\" TYPE FILE
    FILES \"${CMAKE_BINARY_DIR}/install/heliod.service\" \"${CMAKE_SOURCE_DIR}/deploy/systemd/heliod.socket\")")
install(FILES ${CMAKE_SOURCE_DIR}/deploy/systemd/sysusers.conf DESTINATION lib/sysusers.d
  RENAME heliograph.conf)

set(HELIO_DOCDIR ${CMAKE_INSTALL_DATADIR}/doc/heliograph)
install(FILES ${CMAKE_SOURCE_DIR}/README.md ${CMAKE_SOURCE_DIR}/CHANGELOG.md DESTINATION ${HELIO_DOCDIR})
install(FILES ${CMAKE_SOURCE_DIR}/LICENSE DESTINATION ${HELIO_DOCDIR} RENAME copyright)
install(DIRECTORY ${CMAKE_SOURCE_DIR}/docs DESTINATION ${HELIO_DOCDIR}
  FILES_MATCHING PATTERN "*.md" PATTERN "*.jpg" PATTERN "*.png" PATTERN "*.patch")

add_custom_target(uninstall COMMAND ${CMAKE_COMMAND}
  -DMANIFEST=${CMAKE_BINARY_DIR}/install_manifest.txt -P ${CMAKE_SOURCE_DIR}/deploy/uninstall.cmake
  COMMENT "Removing what was installed last" VERBATIM)

# ---- package ------------------------------------------------------------------------------------
# cpack -G DEB, in the build folder. Dependencies are found by dpkg-shlibdeps.
set(HELIO_MAINTAINER "Heliograph developers <heliograph@example.org>" CACHE STRING "Maintainer of the package")
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME heliograph)
set(CPACK_PACKAGE_VERSION ${PROJECT_VERSION})
set(CPACK_PACKAGE_CONTACT ${HELIO_MAINTAINER})
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "renderer of 3D scenes: command line, daemon and client library")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION "Heliograph renders glTF, OBJ, FBX, PLY, STL and Collada scenes,
in real time or path traced, on a GPU or on Mesa's software rasteriser.
This package holds the program helio, the daemon heliod with its workers,
and the client library libhelio with its headers.")
# The prefix is that of the package, whatever the build folder was configured for.
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "mesa-vulkan-drivers | vulkan-icd")
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "fonts-dejavu-core")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "python3, python3-numpy, xdg-utils")
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${CMAKE_SOURCE_DIR}/deploy/debian/postinst
  ${CMAKE_SOURCE_DIR}/deploy/debian/prerm ${CMAKE_SOURCE_DIR}/deploy/debian/triggers)
set(CPACK_PRE_BUILD_SCRIPTS ${CMAKE_SOURCE_DIR}/deploy/debian/finish.cmake)
include(CPack)
