//! The frame of a page: head, style, sections, script.
//!
//! **Input** sections with their bodies. **Output** one HTML document that needs nothing else.
//! **Guarantees** no address of anything outside: a policy in the head forbids the browser to fetch, so that even a fault
//! here could not; texts are escaped by [`maud`] where they are put in.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// Sorts tables by a click on a heading.
pub const TABLE_JS: &str = include_str!("page/table.js");
/// Pan, zoom and values of the map.
pub(crate) const MAP_JS: &str = include_str!("page/map.js");
/// The calibre on the way to a chosen tip.
pub(crate) const PROFILE_JS: &str = include_str!("page/profile.js");
const CSS: &str = include_str!("page/page.css");

/// What a browser may do: nothing but show what is in the file.
const POLICY: &str = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// A page.
#[derive(Clone, Debug)]
pub struct Page<'a> {
    /// Its heading.
    pub title: &'a str,
    /// What stands under the heading.
    pub lead: Markup,
    /// Its sections in order.
    pub sections: Vec<Section>,
    /// The scripts that it needs.
    pub scripts: &'a [&'a str],
}

/// A section of a page.
#[derive(Clone, Debug)]
pub struct Section {
    /// Its name in addresses.
    pub id: &'static str,
    /// Its heading.
    pub title: &'static str,
    /// What it says.
    pub body: Markup,
}

impl Page<'_> {
    /// The document.
    #[must_use]
    pub fn into_html(self) -> String {
        html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta http-equiv="Content-Security-Policy" content=(POLICY);
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    meta name="referrer" content="no-referrer";
                    title { (self.title) }
                    style { (PreEscaped(CSS)) }
                }
                body {
                    header {
                        h1 { (self.title) }
                        (self.lead)
                        nav aria-label="Sections" {
                            @for section in &self.sections { a href={ "#" (section.id) } { (section.title) } }
                        }
                    }
                    main {
                        @for section in &self.sections {
                            section id=(section.id) { h2 { (section.title) } (section.body) }
                        }
                    }
                    footer { p { "For research use only. Not a medical device, not for diagnosis." } }
                    @for script in self.scripts { script { (PreEscaped(script)) } }
                }
            }
        }
        .into_string()
    }
}

/// A column of a table.
#[derive(Clone, Copy, Debug)]
pub struct Head<'a> {
    /// Its heading.
    pub name: &'a str,
    /// What it means, shown when the pointer rests on it.
    pub meaning: &'a str,
    /// Whether it holds numbers.
    pub is_number: bool,
}

/// A table whose rows can be sorted; `class` says how it is drawn.
#[must_use]
pub fn table(class: &str, heads: &[Head<'_>], rows: &[Vec<Markup>]) -> Markup {
    html! {
        div.scroll {
            table class=(class) {
                thead {
                    tr {
                        @for head in heads {
                            th scope="col" title=[(!head.meaning.is_empty()).then_some(head.meaning)]
                                class=[head.is_number.then_some("n")] { (head.name) }
                        }
                    }
                }
                tbody {
                    @for row in rows {
                        tr {
                            @for (cell, head) in row.iter().zip(heads) {
                                td class=[head.is_number.then_some("n")] { (cell) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// A note in place of what is not there.
#[must_use]
pub fn absent(why: &str) -> Markup {
    html! { p.absent { (why) } }
}

/// Bytes of a PNG as an address that holds them.
#[must_use]
pub fn png_address(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

/// Data for a script, as JSON that cannot end its element: of markup, only the characters that begin it matter there.
#[must_use]
pub fn data_block(id: &str, data: &serde_json::Value) -> Markup {
    let text = data.to_string().replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026");
    html! { script type="application/json" id=(id) { (PreEscaped(text)) } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_inert() {
        let evil = "</script><script>alert(1)</script>\"'";
        let head = Head { name: evil, meaning: evil, is_number: false };
        let page = Page {
            title: evil,
            lead: html! { (evil) },
            sections: vec![Section {
                id: "a",
                title: "A",
                body: html! { (table("t", &[head], &[vec![html! { (evil) }]])) (data_block("d", &serde_json::json!([evil]))) },
            }],
            scripts: &[],
        };
        let html = page.into_html();
        assert!(!html.contains("<script>"), "{html}");
        assert_eq!(html.matches("</script>").count(), 1, "only the data block's own end");
    }

    #[test]
    fn own_scripts_and_style_ask_for_nothing() {
        for text in [CSS, TABLE_JS, MAP_JS, PROFILE_JS] {
            for forbidden in ["http", "url(", "@import", "fetch(", "XMLHttp", "eval(", "innerHTML", "</"] {
                assert!(!text.contains(forbidden), "{forbidden}");
            }
        }
    }
}
