/// Snapshots of all points, and the file that shows them in ParaView.

#include "core/run/observer.hpp"
#include "core/scene/geometry.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace testbed
{
void Observer::list_columns()
{
    const auto points = [this](const Location& at) -> const Points<2>& { return solver_.bodies()[at.body].points; };
    const auto vector = [](double* row, double x, double y)
    {
        row[0] = x;
        row[1] = y;
        row[2] = 0;
    };
    const auto list = [&](const char* name, const char* unit, std::size_t columns, auto&& fill) {
        columns_.push_back({name, unit, columns, fill});
    };
    list("position", "m", 3, [=](const Location&, const Place& p, double* row) { vector(row, p.x, p.y); });
    list("initial_position", "m", 3, [=](const Location&, const Place& p, double* row) { vector(row, p.X, p.Y); });
    list("displacement", "m", 3, [=](const Location&, const Place& p, double* row) { vector(row, p.x - p.X, p.y - p.Y); });
    list("velocity", "m/s", 3,
         [=, this](const Location& at, const Place&, double* row)
         {
             const Vec<2> v = solver_.velocity(at.body, at.point);
             vector(row, v[0], v[1]);
         });
    list("stress", "Pa", 6, [this](const Location& at, const Place&, double* row) { std::ranges::copy(stress(at), row); });
    list("volume", "m^2", 1, [=](const Location& at, const Place&, double* row) { *row = points(at).current_volume(at.point); });
    list("initial_volume", "m^2", 1, [=](const Location& at, const Place&, double* row) { *row = points(at).initial_volume; });
    list("mass", "kg/m", 1, [=](const Location& at, const Place&, double* row) { *row = points(at).mass * points(at).weight_share; });
    list_fields();
    if (!exact_.displacement.empty())
        list("exact_displacement", "m", 3,
             [this](const Location&, const Place& p, double* row) { std::ranges::copy(exact_displacement(p), row); });
    if (!exact_.stress.empty())
        list("exact_stress", "Pa", 6, [this](const Location&, const Place& p, double* row) { std::ranges::copy(exact_stress(p), row); });
}

void Observer::list_fields()
{
    std::map<std::string, std::vector<const Field<double>*>> of_bodies;  // null where a body has no such field
    std::vector<const Field<double>*> shown;
    for (std::size_t b = 0; b < solver_.bodies().size(); ++b)
        solver_.bodies()[b].points.for_each_field(
            [&](const auto& field)
            {
                if constexpr (std::is_same_v<std::remove_cvref_t<decltype(field)>, Field<double>>)
                    if (field.output().when != Output::When::never)
                    {
                        auto [entry, is_new] = of_bodies.try_emplace(std::string(field.name()), solver_.bodies().size(), nullptr);
                        entry->second[b] = &field;
                        if (is_new)
                            shown.push_back(&field);
                    }
            });
    for (const Field<double>* field : shown)
    {
        const Output& output = field->output();
        columns_.push_back(
            {std::string(output.name.empty() ? field->name() : output.name), std::string(output.unit.empty() ? field->unit() : output.unit),
             1,
             [of_body = of_bodies[std::string(field->name())], value = output.value](const Location& at, const Place&, double* row)
             {
                 const double held = of_body[at.body] ? (*of_body[at.body])[at.point] : 0.0;
                 *row = of_body[at.body] && value ? value(held) : held;
             },
             output.when == Output::When::at_start});
    }
}

void Observer::snapshot(ResultFile& file, double t, std::int64_t step)
{
    const std::vector<Location> where = locations();
    const std::vector<Vec<2>> initial = initial_positions(scene_);
    const std::string group = fmt::format("/snapshots/{:04}", snapshot_times_.size());
    file.attribute(group, "time", t);
    file.attribute(group, "step", step);
    std::vector<std::string> constant;
    for (const Column& column : columns_)
    {
        if (column.at_start_only && !snapshot_times_.empty())
            continue;
        if (column.at_start_only)
            constant.push_back(column.name);
        std::vector<double> values(where.size() * column.columns);
        for (std::size_t n = 0; n < where.size(); ++n)
            column.fill(where[n], place(where[n], initial[n], t), &values[n * column.columns]);
        file.dataset(group + "/" + column.name, column.unit, values, column.columns);
    }
    std::vector<std::uint32_t> id(where.size()), body(where.size());
    for (std::uint32_t n = 0; n < where.size(); ++n)
    {
        id[n] = n;
        body[n] = where[n].body;
    }
    file.dataset(group + "/id", "-", id);
    file.dataset(group + "/body", "-", body);
    if (!constant.empty())
        file.attribute(group, "constant", fmt::format("{}", fmt::join(constant, " ")));
    file.flush();
    snapshot_times_.push_back(t);
}

std::string Observer::xdmf(const std::string& file_name) const
{
    std::string name;
    for (const char c : file_name)
        name += c == '&' ? "&amp;" : c == '<' ? "&lt;" : std::string(1, c);
    std::size_t n = 0;
    for (const Body& body : solver_.bodies())
        n += body.points.count;
    std::string text = "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\">\n<Domain>\n<Grid Name=\"points\" GridType=\"Collection\" "
                       "CollectionType=\"Temporal\">\n";
    for (std::size_t k = 0; k < snapshot_times_.size(); ++k)
    {
        const auto item = [&](const std::string& field, std::size_t columns, const char* type = "Float")
        {
            return fmt::format(
                "<DataItem Format=\"HDF\" NumberType=\"{}\" Precision=\"{}\" Dimensions=\"{}{}\">{}:/snapshots/{:04}/{}</DataItem>", type,
                *type == 'F' ? 8 : 4, n, columns > 1 ? fmt::format(" {}", columns) : "", name, k, field);
        };
        text += fmt::format("<Grid Name=\"{:04}\">\n<Time Value=\"{}\"/>\n<Topology TopologyType=\"Polyvertex\" NumberOfElements=\"{}\"/>\n"
                            "<Geometry GeometryType=\"XYZ\">{}</Geometry>\n",
                            k, snapshot_times_[k], n, item("position", 3));
        for (const Column& column : columns_)
            if (!column.at_start_only || k == 0)
                text += fmt::format("<Attribute Name=\"{}\" AttributeType=\"{}\" Center=\"Node\">{}</Attribute>\n", column.name,
                                    column.columns == 6   ? "Tensor6"
                                    : column.columns == 3 ? "Vector"
                                                          : "Scalar",
                                    item(column.name, column.columns));
        text += fmt::format("<Attribute Name=\"body\" AttributeType=\"Scalar\" Center=\"Node\">{}</Attribute>\n</Grid>\n",
                            item("body", 1, "UInt"));
    }
    return text + "</Grid>\n</Domain>\n</Xdmf>\n";
}
}  // namespace testbed
