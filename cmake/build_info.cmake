# Writes the source file that tells where a build comes from; touches it only when that changed.
execute_process(COMMAND git -C ${SOURCE_DIR} rev-parse --short=12 HEAD OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
execute_process(COMMAND git -C ${SOURCE_DIR} status --porcelain --untracked-files=no OUTPUT_VARIABLE changes ERROR_QUIET)
if(NOT commit)
  set(commit "unknown")
elseif(changes)
  set(commit "${commit}+changes")
endif()
set(text "#include \"core/base/provenance.hpp\"
namespace testbed
{
const Build& build()
{
    static const Build b{\"${VERSION}\", \"${commit}\", \"${COMPILER}\", \"${FLAGS}\", \"${BUILD_TYPE}\"};
    return b;
}
}  // namespace testbed
")
set(old "")
if(EXISTS ${OUTPUT})
  file(READ ${OUTPUT} old)
endif()
if(NOT old STREQUAL text)
  file(WRITE ${OUTPUT} "${text}")
endif()
