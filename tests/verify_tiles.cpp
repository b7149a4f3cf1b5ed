/* verify_tiles.cpp - the judge of a folder of tiles: every tile of every level is decoded and put beside the raster
 * that it is of, at every sample. It shares no code with what made the tiles; tests/verify_tiles.py runs it.
 *
 *     verify_tiles KIND RASTER FOLDER [SEA]        SEA: the height that voids were given as sea
 *
 * Each kind's judge, a file of its own, names what it looks at; one broken promise makes the exit status 1.
 */
#include "verify_tiles.h"

#include <cstdlib>
#include <filesystem>

void judge_files(Verdict &verdict, const std::string &folder, std::set<std::string> names) {
    Promise &listed = verdict.of("listed: what is listed are the files that there are, each once");
    for (const auto &entry : std::filesystem::recursive_directory_iterator(folder)) {
        const std::string name = std::filesystem::relative(entry.path(), folder).string();
        if (!entry.is_regular_file() || name == ".rqt-tiles") continue;
        verdict.see(listed, names.erase(name) == 1, [&] { return name + " is there and not listed"; });
    }
    for (const std::string &name : names)
        verdict.see(listed, false, [&] { return name + " is listed and not there"; });
}

int main(int argc, char **argv) {
    static const struct {
        const char *name;
        bool (*judge)(const Raster &, const std::string &);
    } kinds[] = {
        {"quantized-mesh", judge_quantized_mesh}, {"3d-tiles", judge_3d_tiles}, {"terrarium", judge_terrarium}};
    Raster raster;
    for (const auto &kind : kinds) {
        if (argc < 4 || argc > 5 || strcmp(argv[1], kind.name) != 0) continue;
        if (raster.open(argv[2], argc > 4 ? std::atof(argv[4]) : NAN)) return kind.judge(raster, argv[3]) ? 0 : 1;
        std::fprintf(stderr, "verify_tiles: %s cannot be read as a raster in longitude and latitude\n", argv[2]);
        return 2;
    }
    std::fprintf(stderr, "verify_tiles KIND RASTER FOLDER [SEA]: every tile of a folder beside the raster that it "
                         "is of; KIND is quantized-mesh, 3d-tiles or terrarium\n");
    return 2;
}
