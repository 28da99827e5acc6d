#pragma once
/// The options of one method as a scene holds them: a table, whatever is in it.

#include <any>

namespace testbed
{
class Reader;
class Writer;
class Documentation;

class MethodOptions
{
public:
    /// @param options a struct with a describe(); Reader, Writer and Documentation must be known where this is called
    template <class Options>
    explicit MethodOptions(const Options& options)
        : options_(options),
          read_(&describe_as<Options, Reader>),
          write_(&describe_as<Options, Writer>),
          document_(&describe_as<Options, Documentation>)
    {
    }
    void describe(Reader& v) { read_(options_, v); }
    void describe(Writer& v) { write_(options_, v); }
    void describe(Documentation& v) { document_(options_, v); }
    /// Nothing if these are the options of another method.
    template <class Options>
    Options* as()
    {
        return std::any_cast<Options>(&options_);
    }

private:
    template <class Options, class Visitor>
    static void describe_as(std::any& options, Visitor& v)
    {
        std::any_cast<Options&>(options).describe(v);
    }

    std::any options_;
    void (*read_)(std::any&, Reader&);
    void (*write_)(std::any&, Writer&);
    void (*document_)(std::any&, Documentation&);
};
}  // namespace testbed
