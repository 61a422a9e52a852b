//! The figure as SVG: surface as a picture, centreline and map as paths, each with its panel's name before its id.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use espalier_model::xml::escape;

use super::{Artist, Kind, Sheet};
use crate::palette::hex;
use crate::svg;

impl Artist<'_> {
    /// The document; `picture` is the surface's PNG.
    pub(super) fn svg(&self, sheet: &Sheet<'_>, picture: Option<&[u8]>) -> String {
        let ([width, height], title) =
            (sheet.size, self.params.title.as_deref().unwrap_or("a tree in space and on the plane"));
        let mut out = String::new();
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" \
             xmlns:xlink=\"http://www.w3.org/1999/xlink\" version=\"1.1\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" data-format=\"espalier-space-svg\" data-version=\"1\">\n\
             <title>{}</title>\n<rect id=\"background\" width=\"{width}\" height=\"{height}\" fill=\"{}\"/>",
            escape(title),
            hex(self.colors.background)
        );
        for frame in &sheet.frames {
            let prefix = match frame.kind {
                Kind::Surface => "surface-",
                Kind::Tubes => "space-",
                Kind::Line => "line-",
                Kind::Map => "map-",
            };
            if let (Kind::Surface, Some(png)) = (frame.kind, picture) {
                let (low, [width, height]) = (frame.page.area[0], frame.page.panel().size());
                let _ = writeln!(
                    out,
                    "<image id=\"surface\" x=\"{}\" y=\"{}\" width=\"{width}\" height=\"{height}\" \
                     xlink:href=\"data:image/png;base64,{}\"/>",
                    low.x,
                    low.y,
                    STANDARD.encode(png)
                );
                continue;
            }
            let content = svg::Content {
                tree: self.subject.tree,
                branches: self.branches,
                scene: &frame.scene,
                coloring: self.coloring,
                title,
                prefix,
            };
            svg::tree(&mut out, &content, &frame.page, &self.colors);
        }
        svg::write_groups(&mut out, &sheet.groups);
        out.push_str("</svg>\n");
        out
    }
}
