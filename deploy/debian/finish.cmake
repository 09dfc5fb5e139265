# finish.cmake - run by CPack before the package is made: manual pages and the change log as Debian
# wants them.
file(GLOB_RECURSE pages "${CPACK_TEMPORARY_DIRECTORY}/usr/share/man/*")
set(docs "${CPACK_TEMPORARY_DIRECTORY}/usr/share/doc/heliograph")
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)
file(WRITE "${docs}/changelog" "heliograph (${CPACK_PACKAGE_VERSION}) unstable; urgency=medium

  * See CHANGELOG.md.

 -- ${CPACK_PACKAGE_CONTACT}  ${date}
")
foreach(file IN LISTS pages ITEMS "${docs}/changelog")
  execute_process(COMMAND gzip -9nf "${file}" COMMAND_ERROR_IS_FATAL ANY)
endforeach()
