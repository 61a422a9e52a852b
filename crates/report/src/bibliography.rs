//! The publications that a run can cite, keyed as in REFERENCES.md.

/// A publication.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Publication {
    pub(crate) key: &'static str,
    /// The kind of entry in BibTeX.
    kind: &'static str,
    /// As in the running text: `Hu et al. 2022`.
    pub(crate) short: &'static str,
    authors: &'static str,
    title: &'static str,
    /// The field for where it appeared, and what stands there.
    venue: (&'static str, &'static str),
    /// Volume, number and pages, or what there is of them, as BibTeX fields.
    place: &'static [(&'static str, &'static str)],
    year: &'static str,
}

impl Publication {
    /// The publication of a key.
    pub(crate) fn find(key: &str) -> Option<&'static Self> {
        ALL.iter().find(|known| known.key == key)
    }

    /// As in a list of references.
    pub(crate) fn long(&self) -> String {
        let field = |name: &str| self.place.iter().find(|(known, _)| *known == name).map(|(_, value)| *value);
        let volume = field("volume").map(|volume| format!(" {volume}")).unwrap_or_default();
        let number = field("number").map(|number| format!("({number})")).unwrap_or_default();
        let pages = field("pages").map(|pages| format!(", {}", pages.replace("--", "–"))).unwrap_or_default();
        let authors = self.authors.replace(" and ", ", ");
        // Initials end with the full stop already.
        let authors = authors.trim_end_matches('.');
        format!("{authors}. {}. {}{volume}{number}{pages}, {}.", self.title, self.venue.1, self.year)
    }

    /// The entry in `references.bib`.
    pub(crate) fn bibtex(&self) -> String {
        let (field, venue) = self.venue;
        let places: String =
            self.place.iter().map(|(name, value)| format!("  {name} = {{{value}}},\n")).collect();
        format!(
            "@{}{{{},\n  author = {{{}}},\n  title = {{{}}},\n  {field} = {{{venue}}},\n{places}  year = {{{}}}\n}}\n",
            self.kind, self.key, self.authors, self.title, self.year
        )
    }
}

const TVCG: (&str, &str) = ("journal", "IEEE Transactions on Visualization and Computer Graphics");

const ALL: [Publication; 17] = [
    Publication {
        key: "Hu2022",
        kind: "article",
        short: "Hu et al. 2022",
        authors: "Hu, P. and Boorboor, S. and Marino, J. and Kaufman, A. E.",
        title: "Geometry-Aware Planar Embedding of Treelike Structures",
        venue: TVCG,
        place: &[],
        year: "2022",
    },
    Publication {
        key: "Marino2015",
        kind: "article",
        short: "Marino and Kaufman 2016",
        authors: "Marino, J. and Kaufman, A.",
        title: "Planar visualization of treelike structures",
        venue: TVCG,
        place: &[("volume", "22"), ("number", "1"), ("pages", "906--915")],
        year: "2016",
    },
    Publication {
        key: "Kanitsar2002",
        kind: "inproceedings",
        short: "Kanitsar et al. 2002",
        authors: "Kanitsar, A. and Fleischmann, D. and Wegenkittl, R. and Felkel, P. and Gröller, E.",
        title: "CPR – curved planar reformation",
        venue: ("booktitle", "IEEE Visualization"),
        place: &[("pages", "37--44")],
        year: "2002",
    },
    Publication {
        key: "Lee94",
        kind: "article",
        short: "Lee et al. 1994",
        authors: "Lee, T.-C. and Kashyap, R. L. and Chu, C.-N.",
        title: "Building skeleton models via 3-D medial surface/axis thinning algorithms",
        venue: ("journal", "CVGIP: Graphical Models and Image Processing"),
        place: &[("volume", "56"), ("number", "6"), ("pages", "462--478")],
        year: "1994",
    },
    Publication {
        key: "Mori1996",
        kind: "inproceedings",
        short: "Mori et al. 1996",
        authors: "Mori, K. and Hasegawa, J. and Toriwaki, J. and Anno, H. and Katada, K.",
        title: "Recognition of bronchus in three-dimensional X-ray CT images with application to virtualized bronchoscopy system",
        venue: ("booktitle", "Proceedings of the International Conference on Pattern Recognition"),
        place: &[("volume", "3"), ("pages", "528--532")],
        year: "1996",
    },
    Publication {
        key: "Ridler1978",
        kind: "article",
        short: "Ridler and Calvard 1978",
        authors: "Ridler, T. W. and Calvard, S.",
        title: "Picture thresholding using an iterative selection method",
        venue: ("journal", "IEEE Transactions on Systems, Man, and Cybernetics"),
        place: &[("volume", "8"), ("number", "8"), ("pages", "630--632")],
        year: "1978",
    },
    Publication {
        key: "Reinhardt1997",
        kind: "article",
        short: "Reinhardt et al. 1997",
        authors: "Reinhardt, J. M. and D'Souza, N. D. and Hoffman, E. A.",
        title: "Accurate measurement of intrathoracic airways",
        venue: ("journal", "IEEE Transactions on Medical Imaging"),
        place: &[("volume", "16"), ("number", "6"), ("pages", "820--827")],
        year: "1997",
    },
    Publication {
        key: "Adams1994",
        kind: "article",
        short: "Adams and Bischof 1994",
        authors: "Adams, R. and Bischof, L.",
        title: "Seeded region growing",
        venue: ("journal", "IEEE Transactions on Pattern Analysis and Machine Intelligence"),
        place: &[("volume", "16"), ("number", "6"), ("pages", "641--647")],
        year: "1994",
    },
    Publication {
        key: "Douglas1973",
        kind: "article",
        short: "Douglas and Peucker 1973",
        authors: "Douglas, D. H. and Peucker, T. K.",
        title: "Algorithms for the reduction of the number of points required to represent a digitized line or its caricature",
        venue: ("journal", "Cartographica"),
        place: &[("volume", "10"), ("number", "2"), ("pages", "112--122")],
        year: "1973",
    },
    Publication {
        key: "Shewchuk1997",
        kind: "article",
        short: "Shewchuk 1997",
        authors: "Shewchuk, J. R.",
        title: "Adaptive precision floating-point arithmetic and fast robust geometric predicates",
        venue: ("journal", "Discrete and Computational Geometry"),
        place: &[("volume", "18"), ("pages", "305--363")],
        year: "1997",
    },
    Publication {
        key: "Kennedy1995",
        kind: "inproceedings",
        short: "Kennedy and Eberhart 1995",
        authors: "Kennedy, J. and Eberhart, R.",
        title: "Particle swarm optimization",
        venue: ("booktitle", "Proceedings of the International Conference on Neural Networks"),
        place: &[("pages", "1942--1948")],
        year: "1995",
    },
    Publication {
        key: "Kirkpatrick1983",
        kind: "article",
        short: "Kirkpatrick et al. 1983",
        authors: "Kirkpatrick, S. and Gelatt, C. D. and Vecchi, M. P.",
        title: "Optimization by simulated annealing",
        venue: ("journal", "Science"),
        place: &[("volume", "220"), ("number", "4598"), ("pages", "671--680")],
        year: "1983",
    },
    Publication {
        key: "Feixas2009",
        kind: "article",
        short: "Feixas et al. 2009",
        authors: "Feixas, M. and Sbert, M. and González, F.",
        title: "A unified information-theoretic framework for viewpoint selection and mesh saliency",
        venue: ("journal", "ACM Transactions on Applied Perception"),
        place: &[("volume", "6"), ("number", "1")],
        year: "2009",
    },
    Publication {
        key: "Strahler1957",
        kind: "article",
        short: "Strahler 1957",
        authors: "Strahler, A. N.",
        title: "Quantitative analysis of watershed geomorphology",
        venue: ("journal", "Transactions of the American Geophysical Union"),
        place: &[("volume", "38"), ("number", "6"), ("pages", "913--920")],
        year: "1957",
    },
    Publication {
        key: "Murray1926",
        kind: "article",
        short: "Murray 1926",
        authors: "Murray, C. D.",
        title: "The physiological principle of minimum work. I. The vascular system and the cost of blood volume",
        venue: ("journal", "Proceedings of the National Academy of Sciences"),
        place: &[("volume", "12"), ("number", "3"), ("pages", "207--214")],
        year: "1926",
    },
    Publication {
        key: "Kruskal1964",
        kind: "article",
        short: "Kruskal 1964",
        authors: "Kruskal, J. B.",
        title: "Multidimensional scaling by optimizing goodness of fit to a nonmetric hypothesis",
        venue: ("journal", "Psychometrika"),
        place: &[("volume", "29"), ("pages", "1--27")],
        year: "1964",
    },
    Publication {
        key: "ColorBrewer",
        kind: "article",
        short: "Harrower and Brewer 2003",
        authors: "Harrower, M. and Brewer, C. A.",
        title: "ColorBrewer.org: an online tool for selecting colour schemes for maps",
        venue: ("journal", "The Cartographic Journal"),
        place: &[("volume", "40"), ("number", "1"), ("pages", "27--37")],
        year: "2003",
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_is_in_the_references() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../REFERENCES.md");
        let references = std::fs::read_to_string(path).expect("REFERENCES.md");
        for publication in ALL {
            assert!(references.contains(&format!("**[{}]**", publication.key)), "{}", publication.key);
            let bibtex = publication.bibtex();
            assert_eq!(bibtex.matches('{').count(), bibtex.matches('}').count());
        }
    }

    #[test]
    fn a_list_entry() {
        let lee = Publication::find("Lee94").expect("known");
        assert!(lee.long().ends_with("Image Processing 56(6), 462–478, 1994."), "{}", lee.long());
    }
}
