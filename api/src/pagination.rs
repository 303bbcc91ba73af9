//! Pages of lists. A page begins behind the id of the last entry before it, so new objects never shift pages.

use crate::base_path::address;
use axum::http::{HeaderValue, Uri, header};
use axum::response::Response;
use serde::de::{Deserialize, Deserializer, Error, Unexpected};
use ulid::Ulid;

/// Entries on a page, 1 to 500; 50 by default.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PageSize(u64);

/// Most entries on a page.
const LARGEST: u64 = 500;

impl Default for PageSize {
    fn default() -> Self {
        Self(50)
    }
}

impl PageSize {
    /// Rows to be read for a page: one more than it has, which tells whether another page follows.
    #[must_use]
    pub fn rows_to_read(self) -> u64 {
        self.0 + 1
    }

    /// Drops the row that belongs to the next page; whether there was one.
    pub fn cut<R>(self, rows: &mut Vec<R>) -> bool {
        let is_more = rows.len() as u64 > self.0;
        rows.truncate(self.0 as usize);
        is_more
    }
}

impl<'de> Deserialize<'de> for PageSize {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let size = u64::deserialize(deserializer)?;
        if (1..=LARGEST).contains(&size) {
            Ok(Self(size))
        } else {
            Err(D::Error::invalid_value(Unexpected::Unsigned(size), &"1 to 500"))
        }
    }
}

/// `next` of the page before: the id of its last entry. Anything else would quietly begin or end the list somewhere.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cursor(pub String);

/// What begins the ids of objects that are listed.
const PREFIXES: [&str; 3] = ["job_", "std_", "upl_"];

impl<'de> Deserialize<'de> for Cursor {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let number = PREFIXES.iter().find_map(|prefix| text.strip_prefix(prefix));
        match number.and_then(|number| number.parse::<Ulid>().ok()) {
            Some(_) => Ok(Self(text)),
            None => Err(D::Error::invalid_type(Unexpected::Str(&text), &"`next` of the page before")),
        }
    }
}

/// Which page of a list.
#[derive(Debug, Clone, Default, serde::Deserialize, utoipa::IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(deny_unknown_fields)]
pub struct PageQuery {
    /// Entries on the page.
    #[serde(default)]
    #[param(value_type = Option<u64>, minimum = 1, maximum = 500, default = 50)]
    pub limit: PageSize,
    /// `next` of the page before.
    #[param(value_type = Option<String>)]
    pub cursor: Option<Cursor>,
}

/// Links to the next page: the same query with another cursor.
pub fn link_next(response: &mut Response, uri: &Uri, cursor: &str) {
    let others = uri.query().unwrap_or_default().split('&').filter(|pair| {
        let name = pair.split('=').next().unwrap_or_default();
        !name.is_empty() && name != "cursor"
    });
    let cursor = format!("cursor={cursor}");
    let query: Vec<&str> = others.chain([cursor.as_str()]).collect();
    let link = format!("<{}?{}>; rel=\"next\"", address(uri.path()), query.join("&"));
    if let Ok(link) = HeaderValue::from_str(&link) {
        response.headers_mut().insert(header::LINK, link);
    }
}

#[cfg(test)]
mod tests {
    use super::{PageQuery, PageSize, link_next};
    use crate::query;
    use axum::http::Uri;
    use axum::response::Response;

    #[test]
    fn the_next_page_has_the_same_query_and_another_cursor() {
        let mut response = Response::default();
        let uri = Uri::from_static("http://host/v1/jobs?state=running&cursor=job_1&name=a%20b&limit=2");
        link_next(&mut response, &uri, "job_2");
        let expected = "</v1/jobs?state=running&name=a%20b&limit=2&cursor=job_2>; rel=\"next\"";
        assert_eq!(response.headers()["link"], expected);
    }

    #[test]
    fn a_size_out_of_range_is_refused_with_its_name() {
        let read = |text: &str| query::parse::<PageQuery>(vec![("limit".to_owned(), text.to_owned())]);
        assert_eq!(read("500").unwrap().limit, PageSize(500));
        for (text, code) in [("501", "range"), ("0", "range"), ("x", "type")] {
            let errors = read(text).unwrap_err();
            assert_eq!((errors[0].pointer.as_str(), errors[0].code.as_str(), errors.len()), ("limit", code, 1));
            assert_eq!(errors[0].got, text);
        }
    }

    #[test]
    fn damaged_cursors_are_refused() {
        let read = |text: &str| query::parse::<PageQuery>(vec![("cursor".to_owned(), text.to_owned())]);
        assert!(read("job_01JZZZZZZZZZZZZZZZZZZZZZZZ").is_ok());
        for text in ["", "junk", "job_", "job_01JZ", "\0", "ckpt_01JZZZZZZZZZZZZZZZZZZZZZZZ"] {
            assert_eq!(read(text).unwrap_err()[0].pointer, "cursor", "{text:?}");
        }
    }

    #[test]
    fn a_row_too_many_tells_of_another_page() {
        let mut rows = vec![0; PageSize::default().rows_to_read() as usize];
        assert!(PageSize::default().cut(&mut rows) && !PageSize::default().cut(&mut rows));
        assert_eq!(rows.len(), 50);
    }
}
