# Writes longleaf.csv, lansing.csv and bei.csv, in metres, from the R package spatstat.data.
#
#   Rscript data/stem_maps/export.R data/stem_maps
#
# needs R and spatstat.data (Debian: r-base-core, r-cran-spatstat.data). No other R package is used.

arguments <- commandArgs(trailingOnly = TRUE)
if (length(arguments) != 1) stop("usage: Rscript export.R DIRECTORY")
directory <- arguments[1]

FOOT <- 0.3048                     # metres, international foot

pattern <- function(name) {
  space <- new.env()
  data(list = name, package = "spatstat.data", envir = space)
  space[[name]]
}

# Fails when the source is not what this script was written for, rather than write another forest's numbers.
check <- function(name, p, count, width, height, unit, multiplier) {
  w <- p$window
  stopifnot(
    p$n == count, length(p$x) == count, length(p$y) == count, !anyNA(p$x), !anyNA(p$y),
    w$type == "rectangle", all.equal(w$xrange, c(0, width)), all.equal(w$yrange, c(0, height)),
    w$units$plural == unit, w$units$multiplier == multiplier
  )
}

write_csv <- function(name, columns) {
  path <- file.path(directory, paste0(name, ".csv"))
  connection <- file(path, "wb")   # binary: the same line ends on every system
  on.exit(close(connection))
  write.table(columns, connection, sep = ",", quote = FALSE, row.names = FALSE, eol = "\n")
  cat(sprintf("%-8s %5d trees -> %s\n", name, nrow(columns), path))
}

# The position in the source is the tree's id; rows keep the source's order, duplicates included.
longleaf <- pattern("longleaf")
check("longleaf", longleaf, 584, 200, 200, "metres", 1)
write_csv("longleaf", data.frame(
  tree_id = seq_len(longleaf$n), x_m = longleaf$x, y_m = longleaf$y, dbh_cm = longleaf$marks
))

lansing <- pattern("lansing")      # scaled to the unit square; one unit is 924 feet
check("lansing", lansing, 2251, 1, 1, "feet", 924)
side <- 924 * FOOT
write_csv("lansing", data.frame(
  tree_id = seq_len(lansing$n),
  x_m = sprintf("%.4f", lansing$x * side), y_m = sprintf("%.4f", lansing$y * side),
  species = as.character(lansing$marks)
))

bei <- pattern("bei")
check("bei", bei, 3604, 1000, 500, "metres", 1)
write_csv("bei", data.frame(tree_id = seq_len(bei$n), x_m = bei$x, y_m = bei$y))
