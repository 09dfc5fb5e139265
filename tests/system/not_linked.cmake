# not_linked.cmake - fails when PROGRAM has symbols that match UNWANTED, or lacks WANTED (which shows
# that symbols can be read).
execute_process(COMMAND ${NM} ${PROGRAM} OUTPUT_VARIABLE out RESULT_VARIABLE rc)
if(rc)
  message(FATAL_ERROR "nm ${PROGRAM} failed")
endif()
if(NOT out MATCHES "[ \n]${WANTED}\n")
  message(FATAL_ERROR "${PROGRAM} does not show ${WANTED}: is it stripped?")
endif()
string(REGEX MATCHALL "[^\n]* (${UNWANTED})[^\n]*" found "${out}")
if(found)
  string(REPLACE ";" "\n" found "${found}")
  message(FATAL_ERROR "${PROGRAM} must be without:\n${found}")
endif()
