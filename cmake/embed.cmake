# Sets `out` to a C++ string literal of what `file` holds; a change of the file configures the build again.
function(octrad_literal out file)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  file(READ ${file} text)
  set(${out} "R\"text(${text})text\"" PARENT_SCOPE)
endfunction()
