/* verify_tiles.h - what the judges of the kinds of tiles have in common: promises and what came of them, files.
 *
 * None shares code with what makes the tiles.
 */
#ifndef VERIFY_TILES_H
#define VERIFY_TILES_H

#include "verify_tiles_raster.h"

#include <cstdio>
#include <deque>
#include <fstream>
#include <set>

struct Promise {
    std::string name, unit;
    long looked = 0, broken = 0;
    double worst = 0;
    std::vector<std::string> examples;
};

class Verdict {
  public:
    Promise &of(const char *name) {
        for (Promise &p : promises)
            if (p.name == name) return p;
        promises.push_back({name, "", 0, 0, 0, {}});
        return promises.back();
    }
    template <typename Where> void see(Promise &p, bool fine, Where where) {
        p.looked++;
        if (fine) return;
        if (p.broken++ < 3) p.examples.push_back(where());
    }
    bool report() const {
        bool fine = true;
        for (const Promise &p : promises) {
            std::printf("%s %s (%ld looked at", p.broken ? "FAILED" : "ok", p.name.c_str(), p.looked);
            if (p.worst > 0) std::printf(", worst %.4f%s", p.worst, p.unit.c_str());
            if (p.broken) std::printf(", %ld broken", p.broken);
            std::printf(")\n");
            for (const std::string &e : p.examples) std::printf("    %s\n", e.c_str());
            fine = fine && p.broken == 0;
        }
        return fine;
    }

  private:
    std::deque<Promise> promises; /* references to them stay good */
};

/* Empty when there is none. */
static inline std::vector<uint8_t> read_file(const std::string &path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}
static inline std::string name_of(int z, int x, int y) {
    return std::to_string(z) + "/" + std::to_string(x) + "/" + std::to_string(y);
}
/* Sees that these names, and no others, are files of the folder. */
void judge_files(Verdict &verdict, const std::string &folder, std::set<std::string> names);

/* False: something is not as promised. A table with a line a level and the promises go to stdout. */
bool judge_quantized_mesh(const Raster &raster, const std::string &folder);
bool judge_3d_tiles(const Raster &raster, const std::string &folder);
bool judge_terrarium(const Raster &raster, const std::string &folder);

#endif
