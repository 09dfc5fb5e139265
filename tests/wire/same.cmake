# same.cmake - fails when the output of TOOL ARG differs from the stored FILE.
#   cmake -DTOOL=... -DARG=... -DFILE=... -P same.cmake
execute_process(COMMAND ${TOOL} ${ARG} OUTPUT_VARIABLE made RESULT_VARIABLE rc)
if(NOT rc EQUAL 0)
  message(FATAL_ERROR "${TOOL} ${ARG} ended with ${rc}")
endif()
file(READ ${FILE} stored)
if(NOT made STREQUAL stored)
  message(FATAL_ERROR "${FILE} is not what messages.def gives. New messages and fields: append the "
    "lines of '${TOOL} ${ARG}' that are missing. A line that changed is a break of the wire.")
endif()
