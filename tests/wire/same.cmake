# same.cmake - fails when what TOOL writes differs from the stored FILE.
#   cmake -DTOOL=program -DARGS=arg,arg,... -DFILE=path [-DMADE=path] -P same.cmake
# Without MADE the tool writes to its standard output, otherwise to MADE.
string(REPLACE "," ";" args "${ARGS}")
execute_process(COMMAND ${TOOL} ${args} OUTPUT_VARIABLE made RESULT_VARIABLE rc)
if(NOT rc EQUAL 0)
  message(FATAL_ERROR "${TOOL} ${args} ended with ${rc}")
endif()
if(MADE)
  file(READ ${MADE} made)
endif()
file(READ ${FILE} stored)
if(NOT made STREQUAL stored)
  message(FATAL_ERROR "${FILE} is not what protocol/messages.def gives: build the target "
    "protocol_update and commit its changes. A stored vector of a released version never changes; "
    "if one did, the change breaks the wire.")
endif()
